"""Tests that feed the package what broken programs, disks and strangers might give it."""
