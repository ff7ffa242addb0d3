"""The former place of the trust manager."""

raise ImportError("roletrust_env.service has moved; import from roletrust_manager instead")
