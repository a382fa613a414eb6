"""Finding, naming and proving an effect that a declared model lacks, from what it leaves."""
