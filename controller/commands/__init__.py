"""What can be asked of the machine, each declared once, in ``table``.

A row of the table has a command's name, its arguments with ranges, units and meaning, who may give it, in
which modes it is possible, and what must hold before. Of it are made:

    socket          the verb, what is read of its arguments and refused (``service.command_handlers``)
    permission      the guard of the route, the lane of the request (``api.access``, ``api.service_client``)
    REST, OpenAPI   the route and the model of its body (``api.routes.commands``)
    command line    the client verb and its arguments (``cli.commands``)
    page            when a button is grey, and the sentence that says why (GET /api/v1/commands)
    tick            which requests are switches, and which are taken in every mode (``state.modes``)

The room imports nothing but values, for the tick, the command line and the page's server all read it.
"""
