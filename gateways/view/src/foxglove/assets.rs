//! Files that Foxglove clients can fetch: parts of the program, by their names. No path of the file system is ever read.

/// What there is.
const ASSETS: [(&str, &[u8]); 1] = [(
    "package://hero_ril/helicopter.urdf",
    include_bytes!("helicopter.urdf"),
)];

/// The file of this name, or why there is none.
pub(crate) fn find(uri: &str) -> Result<&'static [u8], &'static str> {
    let mut assets = ASSETS.iter();
    let found = assets.find(|(name, _)| *name == uri);
    found
        .map(|(_, bytes)| *bytes)
        .ok_or("there is no such file")
}
