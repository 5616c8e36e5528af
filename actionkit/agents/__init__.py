"""Agents: actions and topics of a robot as tools for a language model, within limits."""
