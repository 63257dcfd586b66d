"""Download flights from the drone to this computer.

`ftp_client` implements MAVLink FTP, and `drone_files` selects the fastest link to the drone.
`downloads` fetches for the page and shows progress; `same_flight` protects local files.
"""
