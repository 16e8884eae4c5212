"""The method itself (Schmidl & Lin 2004). Arrays in, arrays out; knows no scenario, file or engine."""
