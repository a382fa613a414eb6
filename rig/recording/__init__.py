"""Recording a session: campaigns run by run, single logs, and the residual watch over both."""
