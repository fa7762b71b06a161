//! The page's files, which are parts of the program: no file is read at run time.

use data_encoding::HEXLOWER;
use sha2::{Digest, Sha256};

/// A file of the page.
pub(crate) struct Asset {
    /// How requests name it.
    pub path: &'static str,
    pub content_type: &'static str,
    pub bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const PICTURE: &str = "image/svg+xml";
const TEXT: &str = "text/plain; charset=utf-8";

/// One row an asset: the file in `page/`, and what it is.
macro_rules! assets {
    ($($path:literal $content_type:ident;)*) => {
        &[$(Asset {
            path: concat!("/", $path),
            content_type: $content_type,
            bytes: include_bytes!(concat!("../page/", $path)),
        }),*]
    };
}

/// All files that a browser may ask for. `tests/http.rs` compares it with the folder.
const ASSETS: &[Asset] = assets! {
    "index.html" HTML;
    "ages.js" SCRIPT;
    "app.js" SCRIPT;
    "banner.js" SCRIPT;
    "bar.js" SCRIPT;
    "contact.js" SCRIPT;
    "dom.js" SCRIPT;
    "format.js" SCRIPT;
    "geo.js" SCRIPT;
    "history.js" SCRIPT;
    "icon.svg" PICTURE;
    "instruments.js" SCRIPT;
    "link.js" SCRIPT;
    "lists.js" SCRIPT;
    "map.js" SCRIPT;
    "marks.js" SCRIPT;
    "model.js" SCRIPT;
    "orders.js" SCRIPT;
    "own_place.js" SCRIPT;
    "plot.js" SCRIPT;
    "plots.js" SCRIPT;
    "protocol.js" SCRIPT;
    "replay.js" SCRIPT;
    "settings.js" SCRIPT;
    "sheets.js" SCRIPT;
    "sound.js" SCRIPT;
    "style.css" STYLE;
    "tabs.js" SCRIPT;
    "theme.css" STYLE;
    "theme.js" SCRIPT;
    "words.js" SCRIPT;
    "vendor/leaflet.LICENSE" TEXT;
    "vendor/leaflet.css" STYLE;
    "vendor/leaflet.js" SCRIPT;
    "vendor/uplot.LICENSE" TEXT;
    "vendor/uplot.css" STYLE;
    "vendor/uplot.js" SCRIPT;
};

/// The page's files with what is known of them.
#[derive(Debug)]
pub(crate) struct Assets {
    /// Beside each of [`ASSETS`], in their order.
    tags: Vec<String>,
    build: String,
}

impl Assets {
    pub fn new() -> Assets {
        let mut all = Sha256::new();
        let mut tags = Vec::new();
        for asset in ASSETS {
            let hash = Sha256::digest(asset.bytes);
            all.update(asset.path);
            all.update(hash);
            tags.push(format!("\"{}\"", short(&hash)));
        }
        Assets {
            tags,
            build: short(&all.finalize()),
        }
    }

    /// Hash of all files: another one is another page.
    pub fn build(&self) -> &str {
        &self.build
    }

    /// The file that a request names, with its entity tag; `None` if there is none.
    pub fn find(&self, path: &str) -> Option<(&'static Asset, &str)> {
        let path = if path == "/" { "/index.html" } else { path };
        let index = ASSETS.iter().position(|asset| asset.path == path)?;
        Some((&ASSETS[index], &self.tags[index]))
    }
}

/// The first 64 bits, which suffice to distinguish the files of one program.
fn short(hash: &[u8]) -> String {
    HEXLOWER.encode(&hash[..8])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_and_build_are_hashes() {
        let assets = Assets::new();
        let (index, tag) = assets.find("/").unwrap();
        assert_eq!((index.path, tag.len()), ("/index.html", 18));
        assert_ne!(assets.find("/app.js").unwrap().1, tag);
        assert_eq!(assets.build().len(), 16);
        assert_eq!(assets.build(), Assets::new().build());
        for none in [
            "",
            "index.html",
            "/../Cargo.toml",
            "/vendor",
            "/vendor/",
            "/test/pure.test.mjs",
        ] {
            assert!(assets.find(none).is_none(), "{none}");
        }
    }
}
