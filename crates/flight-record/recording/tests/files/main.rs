//! Files of a recorder on a simulated disk, read by our reader and by that of the crate `mcap`.

mod compressed;
mod crash;
mod disk;
mod hostile;
mod losses;
mod session;
mod splits;
mod stock;
mod whole;
