//! Seeds, as the missions of the tests have them.

#[cfg_attr(not(test), expect(dead_code, reason = "the tests fly by it"))]
#[path = "../../../tests/tests/missions/seeds.rs"]
pub mod seeds;
