"""Light computed on the CPU: HDRIs, prefiltering, sky visibility and indirect light."""
