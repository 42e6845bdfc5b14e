//! Files that commands write: without the loss of others, and whole or not at all.

mod download;
mod out_folder;
mod tradeoff;
mod whole_file;

pub(crate) use download::{download, download_some};
pub(crate) use out_folder::{OutFolder, is_rendered};
pub(crate) use tradeoff::is_of_tradeoff;
#[cfg(feature = "embedded")]
pub(crate) use tradeoff::read_tradeoff;
pub(crate) use whole_file::{folder_of, keep};
