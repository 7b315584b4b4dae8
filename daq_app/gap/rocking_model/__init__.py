"""The rocking wall for the diagnosis: runs, features, effects; the physics is `sim_hardware`'s own."""
