//! What `ril view` and `ril run view` take.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::Args;
use runtime::args::{SettingsArgs, robot};

use operator::options::EXIT_CODES;

/// `ril view`
///
/// Starts `ril run view` in the background if no view of this user runs on the port, and opens its page in a browser. With FILE, plays
/// that recording in the page until it is interrupted.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXIT_CODES)]
pub struct ViewArgs {
    /// Recording of a flight (MCAP) to be played; where the port is in use and --port does not name it, one of the next ports is taken
    #[arg(value_name = "FILE", conflicts_with_all = ["stop", "layout"])]
    pub file: Option<PathBuf>,

    /// What the server takes.
    #[command(flatten)]
    pub server: ServerArgs,

    /// Print the address of the page instead of opening it; the address contains the token, so anyone with it can give orders
    #[arg(long)]
    pub no_browser: bool,

    /// Print it as one JSON object instead of opening the page
    #[arg(long)]
    pub json: bool,

    /// Print the address of the page for another machine, with the token NAME of view.toml, and as a QR code; anyone with the address can do what the token allows
    #[arg(long, value_name = "NAME", conflicts_with_all = ["no_browser", "json"])]
    pub invite: Option<String>,

    /// End the view that runs on the port
    #[arg(long, conflicts_with_all = ["no_browser", "json", "invite"])]
    pub stop: bool,

    /// Print panels for a robot, which Foxglove and Lichtblick import as a layout
    #[arg(long, conflicts_with_all = ["no_browser", "json", "stop"])]
    pub layout: bool,
}

/// `ril run view`
///
/// The page is at http://127.0.0.1:PORT/; view.toml opens it to other machines.
#[derive(Args, Clone, Debug)]
pub struct RunViewArgs {
    /// What the server takes.
    #[command(flatten)]
    pub server: ServerArgs,

    /// Leave the session of the terminal: `ril view` starts it so
    #[arg(long, hide = true)]
    pub own_session: bool,
}

/// What the server takes, however it is started.
#[derive(Args, Clone, Debug)]
pub struct ServerArgs {
    /// Port [default: 8765, or view.toml]
    #[arg(long, value_name = "PORT", value_parser = clap::value_parser!(u16).range(1..))]
    pub port: Option<u16>,

    /// Which robot; can be given several times, or as 1,2,5 [default: all robots that are alive, those that come later included]
    #[arg(long = "robot", value_name = "N", env = "RIL_ROBOT", value_delimiter = ',', value_parser = robot)]
    pub robots: Vec<NonZeroU32>,

    /// Folder of imagery to be drawn under the map: files {zoom}/{x}/{y}.png, .jpg or .webp [default: view.toml; without any, a grid alone]
    #[arg(long, value_name = "FOLDER")]
    pub tiles: Option<PathBuf>,

    /// Rows of tiles are counted from the south (TMS), as `gdal2tiles.py` without --xyz writes them
    #[arg(long)]
    pub tiles_tms: bool,

    /// Configuration and log.
    #[command(flatten)]
    pub settings: SettingsArgs,
}
