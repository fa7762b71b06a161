//! What the verbs know of a view's configuration and surroundings: `ril view` to run it, `ril doctor` to look at it.
//!
//! * [`config`]: the file `view.toml`;
//! * [`token_key`]: the secret from which the tokens of `[tokens]` are made;
//! * [`certificate`]: until when a certificate holds;
//! * [`peer`]: which process and user is at the other end of a connection;
//! * [`run_file`]: what a running view leaves for programs of the same user.

pub(crate) mod certificate;
pub(crate) mod config;
pub(crate) mod peer;
pub(crate) mod run_file;
pub(crate) mod token_key;
