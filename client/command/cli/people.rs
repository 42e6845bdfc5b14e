//! `yoto people`: experiments on many people in one model.

use crate::args;
use crate::args::tier_help;
use crate::screen::Terminal;
use crate::show;
use clap::{Args, Subcommand, value_parser};
use std::path::PathBuf;
use yoto_avatar::config::Setting;
use yoto_avatar::train::Budget;
use yoto_lab::people::People as Whom;
use yoto_lab::people::joining::{self, Joining, JoiningOptions, Stage};
use yoto_lab::people::prior::{self, Point, PriorOptions, Start};
use yoto_lab::people::scale::{self, Row, ScaleOptions};
use yoto_lab::report::SplitScores;
use yoto_terminal::output;

const JOIN_HELP: &str = "\
All but the last person are trained together. Then the last one joins, as with `yoto model add-person`;
with --refine-steps everybody is trained further, and last everybody from the start, with as many steps on
that person. JSON output has everybody's figures after each training. The captures are laid
out as `yoto quality --help` says.

Examples:
  yoto people join --capture data/ada data/bob data/cleo --tier fast --seconds 60
  yoto people join --synthetic 3 --tier splat --steps 200 --join-steps 300";

const SCALE_HELP: &str = "\
Made-up people of all builds and clothes. OUT/scale.json holds all figures,
OUT/people-N.png everybody: a held-out picture beside its render.

Example:
  yoto people scale --people 1,3,6,22 --tier splat --size 96 --steps 200 --out out/scale";

const PRIOR_HELP: &str = "\
Example:
  yoto people prior --capture data/ada data/bob --tier fast --seconds 60 --target 30";

/// Experiments on many people in one model: their cost, people who join, a trunk as a start.
#[derive(Debug, Args)]
pub(crate) struct PeopleCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Let somebody join a trained model, and compare with a joint training.
    #[command(after_help = JOIN_HELP)]
    Join(Join),
    /// Train more and more people at equal steps per person.
    #[command(after_help = SCALE_HELP)]
    Scale(Scale),
    /// Train with the trunk of another model as a start, and without.
    #[command(after_help = PRIOR_HELP)]
    Prior(Prior),
}

/// What all of them need.
#[derive(Debug, Args)]
struct Common {
    /// Quality tier.
    #[arg(long, default_value = "fast", value_parser = args::tier, long_help = tier_help())]
    tier: String,
    /// Longest side of the pictures, pixels.
    #[arg(long, value_name = "PX", default_value_t = 128, value_parser = value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Measure at most this many held-out pictures of each kind and person.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = value_parser!(u16).range(1..))]
    measure: u16,
    /// Random seed of the trainings.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Different value for one of the tier's settings, as in optimise.patches=4; may be repeated.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<Setting>,
}

#[derive(Debug, Args)]
struct WhomArgs {
    /// Capture folders, one per person.
    #[arg(long = "capture", value_name = "DIR", required_unless_present = "synthetic", num_args = 1..)]
    captures: Vec<PathBuf>,
    /// So many made-up people, in place of captures.
    #[arg(long, value_name = "N", conflicts_with = "captures", value_parser = value_parser!(u8).range(1..))]
    synthetic: Option<u8>,
}

impl WhomArgs {
    fn people(&self) -> Whom {
        match self.synthetic {
            Some(count) => Whom::Synthetic(count.into()),
            None => Whom::Captures(self.captures.clone()),
        }
    }
}

#[derive(Debug, Args)]
struct Join {
    #[command(flatten)]
    whom: WhomArgs,
    /// Steps of the others' training, for each of them.
    #[arg(long, value_name = "N", default_value_t = 700, value_parser = value_parser!(u64).range(1..))]
    steps: u64,
    /// Seconds of the one who joins.
    #[arg(long, value_name = "S", default_value = "60", value_parser = args::seconds, conflicts_with = "join_steps")]
    seconds: f64,
    /// Steps of the one who joins, in place of seconds.
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..))]
    join_steps: Option<u64>,
    /// Then also train everybody further, for so many steps each.
    #[arg(long, value_name = "N", default_value_t = 0)]
    refine_steps: u64,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Args)]
struct Scale {
    /// Numbers of people, separated by commas.
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [1, 3, 6, 22], value_parser = value_parser!(u16).range(1..=1000))]
    people: Vec<u16>,
    /// Frames of the people's films, in turn, separated by commas.
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [60], value_parser = value_parser!(u16).range(4..=1000))]
    frames: Vec<u16>,
    /// Steps for each person.
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = value_parser!(u64).range(1..))]
    steps: u64,
    /// Also train everybody in a model of their own, with the same steps.
    #[arg(long)]
    separate: bool,
    /// Folder for the figures and the sheets.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    common: Common,
}

#[derive(Debug, Args)]
struct Prior {
    #[command(flatten)]
    whom: WhomArgs,
    /// Made-up people of whom the trunk is learned.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = value_parser!(u8).range(1..))]
    prior_people: u8,
    /// Steps of that training, for each of them.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = value_parser!(u64).range(1..))]
    prior_steps: u64,
    /// Seconds of the trainings that are compared.
    #[arg(long, value_name = "S", default_value = "60", value_parser = args::seconds, conflicts_with = "steps")]
    seconds: f64,
    /// Steps of the trainings that are compared, in place of seconds.
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// Quality that is waited for, dB on held-out views.
    #[arg(long, value_name = "DB", default_value_t = 30.0)]
    target: f64,
    #[command(flatten)]
    common: Common,
}

impl PeopleCommand {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Join(command) => command.run(),
            Action::Scale(command) => command.run(),
            Action::Prior(command) => command.run(),
        }
    }
}

impl Join {
    fn run(self) -> anyhow::Result<()> {
        let common = self.common;
        let options = JoiningOptions {
            people: self.whom.people(),
            tier: common.tier,
            settings: common.settings,
            size: common.size,
            steps: self.steps,
            budget: match self.join_steps {
                Some(steps) => Budget::Steps(steps),
                None => Budget::Seconds(self.seconds),
            },
            refine: self.refine_steps,
            pictures: common.measure.into(),
            seed: common.seed,
        };
        let found = joining::run(&options, &Terminal)?;
        output::put("joining", serde_json::to_value(&found)?);
        say!("{}", joining_table(&found));
        anyhow::ensure!(
            found.others_equal,
            "somebody else changed: {} before, {} after",
            found.others_before,
            found.others_after
        );
        Ok(())
    }
}

fn joining_table(found: &Joining) -> String {
    let count = found.others.len();
    let row = |stage: &Stage| {
        let [views, poses]: [fn(&SplitScores) -> f64; 2] =
            [|it| it.novel_view.psnr, |it| it.novel_pose.psnr];
        let (own, others) = (stage.joined(count), stage.others(count));
        let own = |of: fn(&SplitScores) -> f64| {
            let own = own.as_ref();
            own.map_or("-".to_owned(), |scores| format!("{:.2}", of(scores)))
        };
        vec![
            stage.name.clone(),
            stage.spent.steps.to_string(),
            format!("{:.1}", stage.spent.seconds),
            own(views),
            own(poses),
            format!("{:.2}", views(&others)),
            format!("{:.2}", poses(&others)),
        ]
    };
    let rows: Vec<Vec<String>> = found.stages.iter().map(row).collect();
    let header = [
        "TRAINING",
        "STEPS",
        "SECONDS",
        &format!("{}: VIEWS, dB", found.name),
        "POSES, dB",
        "OTHERS: VIEWS, dB",
        "POSES, dB",
    ];
    let others = if found.others_equal {
        "are equal"
    } else {
        "DIFFER"
    };
    format!(
        "{}\nweights and renders of {} {others} before and after: {}",
        show::table(&header, &rows),
        found.others.join(", "),
        found.others_after
    )
}

impl Scale {
    fn run(self) -> anyhow::Result<()> {
        let common = self.common;
        let options = ScaleOptions {
            people: self.people.into_iter().map(usize::from).collect(),
            tier: common.tier,
            settings: common.settings,
            size: common.size,
            frames: self.frames.into_iter().map(usize::from).collect(),
            steps: self.steps,
            separate: self.separate,
            pictures: common.measure.into(),
            seed: common.seed,
            out: self.out,
        };
        let rows = scale::run(&options, &Terminal, |_| ())?;
        output::put("scale", serde_json::to_value(&rows)?);
        let header = [
            "PEOPLE",
            "STEPS",
            "STEP, ms",
            "PEAK, MB",
            "CHECKPOINT, MB",
            "VIEWS, dB",
            "LOWEST",
            "POSES, dB",
            "LOWEST",
            "SEPARATE VIEWS",
            "POSES",
        ];
        let rows: Vec<Vec<String>> = rows.iter().map(scale_row).collect();
        say!("{}", show::table(&header, &rows));
        Ok(())
    }
}

fn scale_row(row: &Row) -> Vec<String> {
    let megabytes = |bytes: u64| format!("{:.1}", bytes as f64 / 1e6);
    let (views, poses) = row.worst();
    let alone = row.mean_alone();
    let separate = |of: fn(&SplitScores) -> f64| {
        let alone = alone.as_ref();
        alone.map_or("-".to_owned(), |mean| format!("{:.2}", of(mean)))
    };
    vec![
        row.people.to_string(),
        row.steps.to_string(),
        format!("{:.1}", row.step_ms),
        row.peak_bytes.map_or("-".to_owned(), megabytes),
        megabytes(row.checkpoint_bytes),
        format!("{:.2}", row.mean.novel_view.psnr),
        format!("{views:.2}"),
        format!("{:.2}", row.mean.novel_pose.psnr),
        format!("{poses:.2}"),
        separate(|it| it.novel_view.psnr),
        separate(|it| it.novel_pose.psnr),
    ]
}

impl Prior {
    fn run(self) -> anyhow::Result<()> {
        let common = self.common;
        let options = PriorOptions {
            people: self.whom.people(),
            prior_people: self.prior_people.into(),
            prior_steps: self.prior_steps,
            tier: common.tier,
            settings: common.settings,
            size: common.size,
            budget: match self.steps {
                Some(steps) => Budget::Steps(steps),
                None => Budget::Seconds(self.seconds),
            },
            pictures: common.measure.into(),
            seed: common.seed,
        };
        let found = prior::run(&options, &Terminal)?;
        output::put("prior", serde_json::to_value(&found)?);
        let row = |name: &str, start: &Start| {
            let reached = start.reached(self.target);
            let last = start.points.last();
            let decibel = |of: fn(&Point) -> f64| {
                last.map_or("-".to_owned(), |point| format!("{:.2}", of(point)))
            };
            vec![
                name.to_owned(),
                reached.map_or("never".to_owned(), |it| it.steps.to_string()),
                reached.map_or("never".to_owned(), |it| format!("{:.1}", it.seconds)),
                decibel(|it| it.views),
                decibel(|it| it.poses),
            ]
        };
        let steps = format!("STEPS TO {} dB", self.target);
        let seconds = format!("SECONDS TO {} dB", self.target);
        let header = ["START", &steps, &seconds, "VIEWS, dB", "POSES, dB"];
        let rows = [
            row("its own", &found.without),
            row("another's trunk", &found.with),
        ];
        say!("{}", show::table(&header, &rows));
        say!("the trunk was learned in {:.0} s", found.prior_seconds);
        Ok(())
    }
}
