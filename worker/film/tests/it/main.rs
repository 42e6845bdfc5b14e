//! Plans of all kinds of renders, without a job: no network, no model.

mod one_person;
mod people;
mod scenes;
