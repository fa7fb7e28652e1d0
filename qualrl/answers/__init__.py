"""Answers to questions about a plan, one file a question, and what they share."""
