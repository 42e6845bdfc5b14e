//! Parts shared by the black-box tests: real processes that end with the test, captures and videos
//! of synthetic people on disk, a browser.

pub mod browser;
pub mod bvh;
pub mod element;
pub mod film;
pub mod folders;
pub mod jobs;
pub mod page;
pub mod people;
pub mod phone;
pub mod playback;
pub mod process;
pub mod upload;
