//! What is watched and what is done about it: from the signs of each stage to orders.

mod order;

pub(crate) use order::Order;
