"""Wire models of requests and answers, without logic."""
