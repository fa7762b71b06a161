//! `ril`: the operator's tool of the HERO's Robot Implementation Layer, and its one installed binary.
//!
//! * [`cli`]: the command line, with the exit codes;
//! * [`config`]: the file `ril.toml`;
//! * [`commands`]: the operator's commands, thin shells around pure values;
//! * [`demo`]: a whole simulated mission with one command;
//! * [`words`]: reports in words, as JSON and as exit codes;
//! * [`fields`]: the fields of samples by name, and which of them mean something.
//!
//! `ril bridge`, `ril status` and `ril sim` are those crates' own command lines. Nothing here decides what the helicopter
//! does: that is the bridge's.
//!
//! # Example
//!
//! ```
//! use ipc_types::code::{Reason, Stage};
//! use ipc_types::payload::RequestReport;
//! use ril::words::{self, FinalWord, Verb};
//!
//! let report = RequestReport::new(Stage::Refused, Reason::LinkDown);
//! assert_eq!(words::line(Verb::Start, 0, 1, &report).as_deref(), Some("start: refused (link-down)"));
//! let word = FinalWord::of(&report).expect("a refusal is a final word");
//! assert_eq!(word.exit_code().code(), 6);
//! ```

pub mod cli;
pub mod commands;
pub mod config;
pub mod demo;
pub mod fields;
pub mod words;
