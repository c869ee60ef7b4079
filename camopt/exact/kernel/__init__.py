"""The compiled kernel of event-exact: exact propagation over spans, with every switching inside them located."""
