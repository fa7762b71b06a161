//! Plays random orders of several senders to a bridge, late, out of order and doubled, and checks that at the end the helicopter
//! does what was ordered last.
//!
//! `cargo run --release -p bridge --example orders_check [SEQUENCES [SEED]]`; 100,000 sequences from seed 1 without arguments. Ends
//! with status 101 and the sequence when it does something else.

#[path = "../tests/orders/chance.rs"]
mod chance;
#[path = "../tests/desk/mod.rs"]
mod desk;

fn main() {
    let mut args = std::env::args().skip(1).map(|arg| {
        arg.parse()
            .expect("usage: orders_check [SEQUENCES [SEED]], both whole numbers")
    });
    let sequences: u64 = args.next().unwrap_or(100_000);
    let seed: u64 = args.next().unwrap_or(1);
    println!("{:#?}", chance::play(seed, sequences));
}
