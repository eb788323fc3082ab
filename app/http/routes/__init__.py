"""The addresses of the service, a module per kind of thing behind them."""
