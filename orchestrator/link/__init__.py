"""The only modules that touch pyserial, python-can and canopen; their exceptions end here, translated."""
