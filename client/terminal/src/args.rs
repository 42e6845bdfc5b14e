//! Options that the commands of both programs have.

use crate::output::{Style, set_style};
use clap::builder::OsStringValueParser;
use clap::{Args, ValueEnum};
use std::ffi::OsString;
use std::path::PathBuf;

/// Variable of [`LpipsArgs`] for the weights of VGG16.
pub const VGG16_VARIABLE: &str = "YOTO_VGG16_WEIGHTS";
/// Variable of [`LpipsArgs`] for the linear heads.
pub const HEADS_VARIABLE: &str = "YOTO_LPIPS_WEIGHTS";

/// What a command shows.
#[derive(Debug, Clone, Args)]
pub struct OutputArgs {
    /// Format of results on stdout: text for people, or one JSON object for programs.
    #[arg(
        long,
        global = true,
        value_enum,
        value_name = "FORMAT",
        default_value = "text"
    )]
    output: Format,
    /// Print results and errors only.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Show no progress.
    #[arg(long, global = true)]
    no_progress: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

impl OutputArgs {
    /// Sets the style of this process, whose command keeps details to a log if it is `brief`.
    pub fn set_style(&self, brief: bool) {
        set_style(Style {
            json: self.output == Format::Json,
            quiet: self.quiet,
            no_progress: self.no_progress || self.quiet,
            brief,
        });
    }
}

/// Where the weights of the networks of LPIPS are. With both files LPIPS is measured, and minimised in patches of 16 pixels
/// or more.
#[derive(Debug, Clone, Default, Args)]
pub struct LpipsArgs {
    /// torchvision's VGG16, .pth or safetensors; needed for LPIPS.
    #[arg(
        long,
        env = VGG16_VARIABLE,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    vgg16_weights: Option<OsString>,
    /// Linear heads of LPIPS 0.1 for VGG, .pth or safetensors; needed for LPIPS.
    #[arg(
        long,
        env = HEADS_VARIABLE,
        value_name = "FILE",
        value_parser = OsStringValueParser::new(),
        hide_short_help = true
    )]
    lpips_weights: Option<OsString>,
}

impl LpipsArgs {
    /// What `both` makes of the files of VGG16 and of the heads.
    ///
    /// # Errors
    /// As `both`.
    pub fn weights<T, E>(
        self,
        both: impl FnOnce(Option<PathBuf>, Option<PathBuf>) -> Result<T, E>,
    ) -> Result<T, E> {
        both(
            self.vgg16_weights.map(Into::into),
            self.lpips_weights.map(Into::into),
        )
    }
}

/// The commands and options below `command` that lack help, and commands without an example, for the tests of a program.
pub fn undocumented(command: &clap::Command) -> Vec<String> {
    let path = command.get_name();
    let mut lacking = Vec::new();
    if command.get_about().is_none() {
        lacking.push(format!("{path} has no description"));
    }
    let without_help = command
        .get_arguments()
        .filter(|argument| argument.get_help().is_none());
    lacking
        .extend(without_help.map(|argument| format!("{path}: {} has no help", argument.get_id())));
    if !command.has_subcommands() && command.get_after_help().is_none() {
        lacking.push(format!("{path} shows no example"));
    }
    let below = command.get_subcommands().flat_map(undocumented);
    lacking.extend(below.map(|line| format!("{path} {line}")));
    lacking
}
