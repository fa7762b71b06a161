//! The short form of the program `endurance`: loops of kills and of starts, attacks, floods and full memories.

mod attacks;
mod loops;
