"""User configuration: ``uavrt.toml`` and tag files, with all mistakes reported at once.

`settings` has a class for each table of the file; `loader` reads it and `setting_writer`
changes it. `parameters` are the settings that a ground station can change. `tags/tag_files`
reads and writes tag lists by the rules of `tags/tag_rules` and `tags/code_rules`; `radios` is
the table of radios.
"""
