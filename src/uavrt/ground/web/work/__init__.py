"""Work behind the routes: maps, exports, reports, files of others."""
