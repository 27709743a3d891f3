"""One module a command, each thin: read the arguments, call the compiler or the runtime, print."""
