"""Work behind the routes: maps, exports, reports, parsing of untrusted files."""
