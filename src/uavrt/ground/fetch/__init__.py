"""Download flights from the drone to this computer.

`ftp_client` speaks MAVLink FTP, `drone_files` finds the quickest way to the drone,
`downloads` fetches for the page and shows progress, and `same_flight` protects local files.
"""
