"""Download flights from the drone to this computer.

`ftp_client` implements MAVLink FTP, and `drone_files` selects the fastest link to the drone.
`downloads` downloads flights for the web page and shows progress. `same_flight` prevents that a
download overwrites another flight's files.
"""
