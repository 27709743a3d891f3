"""The compiler: recipe text to plans. Pure: no engine, no clock, no environment, no network."""
