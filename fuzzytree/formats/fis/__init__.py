"""MATLAB's and Octave's FIS files."""
