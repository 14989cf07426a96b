"""Tables of the source texts, each computed cell beside the printed one."""
