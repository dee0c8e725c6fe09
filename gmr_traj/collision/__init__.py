"""Self-collision of capsules: closed-form distances, the pairs and frames that matter, the audit afterwards."""
