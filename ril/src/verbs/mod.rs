//! The verbs: each with its options, its shell, its pure values and their tests in one file or folder. A verb imports
//! what all share, never another verb.

pub mod check;
pub mod demo;
pub mod log;
pub mod new;
pub mod order;
pub mod param;
pub mod plan;
pub mod relay;
pub mod replay;
pub mod robots;
pub mod status;
pub mod topic;
pub mod wait;
pub mod watch;
