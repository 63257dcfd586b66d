"""Download flights from the drone to this computer.

`ftp_client` implements MAVLink FTP, `drone_files` selects the fastest link, `downloads` serves
the page, and `same_flight` keeps other flights' files from being overwritten.
"""
