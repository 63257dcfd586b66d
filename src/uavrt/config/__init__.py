"""Configuration set by the user: ``uavrt.toml`` and tag files. All mistakes in a file are
reported at once.

`settings` has a class for each table of ``uavrt.toml``; `loader` reads the file and
`setting_writer` changes it. `parameters` lists the settings that a ground station can change.
`tags/tag_files` reads and writes tag lists and checks them by `tags/tag_rules` and
`tags/code_rules`. `radios` lists the supported radios.
"""
