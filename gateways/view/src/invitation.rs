//! `ril view --invite`: the page's address for another machine, with a token of view.toml, and as a QR code.

use std::io::{IsTerminal, Write};
use std::net::IpAddr;

use qrcodegen::{QrCode, QrCodeEcc};
use runtime::exit::{ExitCode, Failure};

use crate::config::ViewConfig;
use crate::shell::token_key::{self, TokenKey};

/// Light modules around a code, which readers need.
const BORDER: i32 = 2;

/// Prints the invitation of the token `name`.
///
/// # Errors
///
/// Code 2 when view.toml has no such token, 8 when its key cannot be used, 78 when other machines have no address to
/// call.
pub(crate) fn print(config: &ViewConfig, name: &str) -> Result<(), Failure> {
    if !config.tokens.contains_key(name) {
        let text = format!("view.toml has no token `{name}`");
        return Err(Failure::usage(text).with_next_step(format!(
            "add `{name} = \"watch\"`, or \"command\", to its `[tokens]`, and restart the view"
        )));
    }
    let token = TokenKey::open(&token_key::path(config)?)?.token(name);
    let address = format!("{}#token={token}", address(config)?);
    let mut out = std::io::stdout().lock();
    let is_terminal = out.is_terminal();
    let code = QrCode::encode_text(&address, QrCodeEcc::Low).map_err(Failure::internal)?;
    let drawn = draw(code.size(), is_terminal, |x, y| code.get_module(x, y));
    write!(out, "{address}\n\n{drawn}").map_err(Failure::output)
}

/// The page's address as others call it.
fn address(config: &ViewConfig) -> Result<String, Failure> {
    let port = config.port;
    if !config.is_open() {
        return Ok(format!("http://127.0.0.1:{port}/"));
    }
    let scheme = if config.tls.is_some() {
        "https"
    } else {
        "http"
    };
    let is_one = |address: &&IpAddr| !address.is_unspecified() && !address.is_loopback();
    let host = match (config.names.first(), config.listen.iter().find(is_one)) {
        (Some(name), _) => name.clone(),
        (None, Some(IpAddr::V4(address))) => address.to_string(),
        (None, Some(IpAddr::V6(address))) => format!("[{address}]"),
        (None, None) => {
            let text = "`listen` has no address that another machine can call, and `names` no name";
            return Err(Failure::new(ExitCode::Configuration, text).with_next_step(
                "add the name or the address by which others reach this machine to `names` of view.toml",
            ));
        }
    };
    Ok(format!("{scheme}://{host}:{port}/"))
}

/// The code in half blocks, two rows in a line. On a terminal it is black on white, whatever its colours are.
fn draw(size: i32, is_terminal: bool, is_dark: impl Fn(i32, i32) -> bool) -> String {
    let (begin, end) = match is_terminal {
        true => ("\x1b[30;107m", "\x1b[0m\n"),
        false => ("", "\n"),
    };
    let mut text = String::new();
    for y in (-BORDER..size + BORDER).step_by(2) {
        text.push_str(begin);
        for x in -BORDER..size + BORDER {
            text.push(match (is_dark(x, y), is_dark(x, y + 1)) {
                (true, true) => '█',
                (true, false) => '▀',
                (false, true) => '▄',
                (false, false) => ' ',
            });
        }
        text.push_str(end);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn others_call_this_machine_by_its_first_name_or_address() {
        for (text, expected) in [
            ("", Some("http://127.0.0.1:8765/")),
            (
                "listen = [\"10.0.0.2\"]\ninsecure = true\nport = 1",
                Some("http://10.0.0.2:1/"),
            ),
            (
                "listen = [\"::\", \"fd00::2\"]",
                Some("http://[fd00::2]:8765/"),
            ),
            (
                "listen = [\"0.0.0.0\"]\nnames = [\"field.local\"]\n[tls]\ncertificate = \"a\"\nkey = \"b\"",
                Some("https://field.local:8765/"),
            ),
            ("listen = [\"0.0.0.0\"]", None),
        ] {
            let config: ViewConfig = runtime::config::parse(text, "view.toml").unwrap();
            assert_eq!(address(&config).ok().as_deref(), expected, "{text}");
        }
    }

    #[test]
    fn a_code_is_drawn_with_its_border() {
        // Dark are (0, 0), (1, 1) and (2, 2).
        let drawn = draw(3, false, |x, y| x == y && (0..3).contains(&x));
        assert_eq!(drawn, "       \n  ▀▄   \n    ▀  \n       \n");
        let coloured = draw(1, true, |_, _| true);
        assert!(
            coloured.starts_with("\x1b[30;107m█████\x1b[0m\n"),
            "{coloured:?}"
        );
    }
}
