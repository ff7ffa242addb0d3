"""The former place of the trust manager."""

raise ImportError("roletrust_env.live has moved; import from roletrust_manager instead")
