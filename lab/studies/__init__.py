"""Studies that regenerate the tables and charts of carom's own docs: ``python -m carom.lab.studies`` in a checkout.

They are not in the wheel: nothing that is installed imports them. ``make figures`` runs them.
"""
