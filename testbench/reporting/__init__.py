"""report and view: what a person looks at; always rebuilt from the session, its estimate and its
evaluation.
"""
