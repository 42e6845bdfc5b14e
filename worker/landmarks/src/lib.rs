//! Body landmarks and masks of pictures, by a pose model that runs in this process.
