"""The lists of everything that settings and verbs choose by name: the only list of each kind.

Nothing here imports what it names, so that settings, help and completion ask these lists without torch.
"""
