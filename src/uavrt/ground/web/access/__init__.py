"""Who may open the page: addresses, passwords, limits on connections."""
