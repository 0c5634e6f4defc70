//! What the chain says, kept in MCAP files: lossless for replay, in Foxglove's schemas for people.
