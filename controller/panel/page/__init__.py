"""The page an operator works with: views of what the panel's routes tell, and buttons that ask them.

NiceGUI builds the structure, once for each browser that opens the page. Figures and acts live
in the browser (``static/dx.js``): it hears the events and asks by the same routes as any script.
So the page has no way to the machine that a script has not, and a figure has one source.
"""
