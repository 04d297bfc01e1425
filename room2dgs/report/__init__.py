"""Tables (pandas) and HTML pages (Jinja2) of benches and studies."""
