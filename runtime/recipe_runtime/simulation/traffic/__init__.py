"""How vehicles drive: car following, lanes, junctions, signs and lights."""
