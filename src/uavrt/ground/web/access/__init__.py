"""Control who may open the page: addresses, passwords and limits on connections."""
