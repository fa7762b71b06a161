//! The end of a file: its footer, and where the summary begins.

use mcap::records::op;

use super::record::{Fields, HEAD_LEN, Record};

/// Length of footer and mark, bytes.
pub(super) const FOOTER_LEN: usize = HEAD_LEN + 20 + mcap::MAGIC.len();

/// Where the summary begins, by the footer and mark that `bytes` are: 0 without a summary. Nothing when they are something else.
pub(super) fn summary_start(bytes: &[u8]) -> Option<u64> {
    let footer = Record::first(bytes)?;
    let is_footer = footer.opcode == op::FOOTER && footer.content.len() == 20;
    let has_mark = bytes.get(footer.len()..)? == mcap::MAGIC;
    if is_footer && has_mark {
        Fields(footer.content).u64()
    } else {
        None
    }
}

/// The summary section, if the file was finished.
pub(super) fn summary(bytes: &[u8]) -> Option<&[u8]> {
    let footer_at = bytes.len().checked_sub(FOOTER_LEN)?;
    let start = summary_start(&bytes[footer_at..])?;
    let start = usize::try_from(start).ok().filter(|start| *start > 0)?;
    bytes.get(start..footer_at)
}
