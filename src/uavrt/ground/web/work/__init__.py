"""Work done for the routes: maps, exports, reports and parsing of untrusted files."""
