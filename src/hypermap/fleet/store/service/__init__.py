"""A store over HTTP: an API with an OpenAPI description that is OGC API - Features, too."""
