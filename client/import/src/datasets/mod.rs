//! Captures of public datasets and of programs that train avatars, one file per format, and this
//! project's own capture folder.

pub(crate) mod folder;
pub(crate) mod humannerf;
pub(crate) mod instant_avatar;
pub(crate) mod people_snapshot;
pub(crate) mod zju;
