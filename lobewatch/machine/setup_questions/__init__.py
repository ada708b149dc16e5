"""What `lobewatch init` asks: ten questions, and what their answers make of machine.toml."""
