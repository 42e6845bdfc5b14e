//! The form of a network's inputs and outputs, from the declarations in its file.

use rten::{DataType, Dimension, Model, NodeId, ValueType};

/// Longest side of a network's input, pixels, if its file leaves the size open.
const LONGEST: usize = 1024;
/// Shorter side of such an input: MODNet's `ref_size`.
const SHORTER: usize = 512;
/// Sides are multiples of this, since networks halve them up to five times.
const MULTIPLE: usize = 32;
/// Size of RVM's first pass over the whole picture: `auto_downsample_ratio` of its `inference.py`.
const RVM_WHOLE: usize = 512;

/// The form of a matting model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelForm {
    /// One picture in, a matte out.
    Single,
    /// RVM: it also takes its memory of the pictures before.
    Recurrent,
}

/// Order of a picture's axes after the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axes {
    /// Channels, rows, columns.
    ChannelsFirst,
    /// Rows, columns, channels.
    ChannelsLast,
}

/// RVM's inputs and outputs in addition to picture and matte.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recurrence {
    pub ratio: NodeId,
    pub before: [NodeId; 4],
    pub after: [NodeId; 4],
}

/// The inputs and outputs of a matting model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signature {
    pub picture: NodeId,
    pub axes: Axes,
    /// Height and width, if the file declares them.
    size: [Option<usize>; 2],
    pub matte: NodeId,
    pub recurrence: Option<Recurrence>,
}

impl Signature {
    /// The ports of `model`, or what is wrong with it.
    pub(crate) fn of(model: &Model) -> Result<Self, String> {
        let (picture, recurrence) = match *model.input_ids() {
            [one] => (one, None),
            [] => return Err("has no inputs: it is empty, or cut short".into()),
            _ => {
                let picture = model.find_node("src");
                let recurrence = recurrence(model);
                picture
                    .zip(recurrence)
                    .map(|(picture, it)| (picture, Some(it)))
                    .ok_or_else(|| format!("has the inputs {}", names(model, model.input_ids())))?
            }
        };
        let name = name(model, picture);
        let info = model.node_info(picture);
        let dtype = info.as_ref().and_then(rten::NodeInfo::dtype);
        let float = ValueType::Tensor(DataType::Float);
        if let Some(other) = dtype.filter(|dtype| *dtype != float) {
            return Err(format!("the input {name} is of {other}"));
        }
        let shape = info.and_then(|info| info.shape());
        let (axes, size) = match shape.as_deref() {
            None => (Axes::ChannelsFirst, [None; 2]),
            Some([batch, rest @ ..]) if holds(batch, 1) && rest.len() == 3 => picture_of(rest)
                .ok_or_else(|| format!("the input {name} has the shape {}", words(&shape)))?,
            Some(_) => return Err(format!("the input {name} has the shape {}", words(&shape))),
        };
        let named = ["pha", "alpha", "matte"];
        let outputs = model.output_ids();
        let named = named.iter().filter_map(|name| model.find_node(name));
        let matte = named
            .filter(|node| outputs.contains(node))
            .chain(outputs.first().copied())
            .next()
            .ok_or("has no output")?;
        Ok(Self {
            picture,
            axes,
            size,
            matte,
            recurrence,
        })
    }

    pub(crate) fn form(&self) -> ModelForm {
        match self.recurrence {
            Some(_) => ModelForm::Recurrent,
            None => ModelForm::Single,
        }
    }

    /// Height and width of the network's input for a picture of `width` and `height`.
    pub(crate) fn seen(&self, width: usize, height: usize) -> [usize; 2] {
        let (long, short) = (width.max(height) as f64, width.min(height) as f64);
        let scale = match self.form() {
            ModelForm::Single => (SHORTER as f64 / short).min(LONGEST as f64 / long),
            ModelForm::Recurrent => LONGEST as f64 / long,
        };
        let open = |side: usize| match self.form() {
            ModelForm::Single => {
                let steps = (side as f64 * scale.min(1.0) / MULTIPLE as f64).round();
                (steps as usize).max(1) * MULTIPLE
            }
            ModelForm::Recurrent => ((side as f64 * scale.min(1.0)).round() as usize).max(1),
        };
        let [rows, columns] = self.size;
        [
            rows.unwrap_or_else(|| open(height)),
            columns.unwrap_or_else(|| open(width)),
        ]
    }

    /// RVM's `downsample_ratio` for a picture of `rows` and `columns`.
    pub(crate) fn ratio([rows, columns]: [usize; 2]) -> f32 {
        (RVM_WHOLE as f32 / rows.max(columns) as f32).min(1.0)
    }
}

/// Axes and size of a picture with these dimensions; one of them is the three channels.
fn picture_of(shape: &[Dimension]) -> Option<(Axes, [Option<usize>; 2])> {
    let fixed = |dimension: &Dimension| match dimension {
        Dimension::Fixed(size) => Some(*size),
        Dimension::Symbolic(_) => None,
    };
    match shape {
        [channels, rows, columns] if holds(channels, 3) => {
            Some((Axes::ChannelsFirst, [fixed(rows), fixed(columns)]))
        }
        [rows, columns, channels] if holds(channels, 3) => {
            Some((Axes::ChannelsLast, [fixed(rows), fixed(columns)]))
        }
        _ => None,
    }
    .filter(|(_, size)| size.iter().flatten().all(|side| (1..=4096).contains(side)))
}

fn holds(dimension: &Dimension, size: usize) -> bool {
    match dimension {
        Dimension::Fixed(fixed) => *fixed == size,
        Dimension::Symbolic(_) => true,
    }
}

fn recurrence(model: &Model) -> Option<Recurrence> {
    let among = |name: String, nodes: &[NodeId]| {
        let node = model.find_node(&name)?;
        nodes.contains(&node).then_some(node)
    };
    let all = |letter: char, nodes: &[NodeId]| {
        let found: Vec<NodeId> = (1..=4)
            .filter_map(|at| among(format!("r{at}{letter}"), nodes))
            .collect();
        found.try_into().ok()
    };
    (model.input_ids().len() == 6).then_some(())?;
    Some(Recurrence {
        ratio: among("downsample_ratio".into(), model.input_ids())?,
        before: all('i', model.input_ids())?,
        after: all('o', model.output_ids())?,
    })
}

/// The name of an input or output, for people.
pub(crate) fn name(model: &Model, node: NodeId) -> String {
    let info = model.node_info(node);
    let name = info.and_then(|info| info.name());
    name.unwrap_or("without a name").to_owned()
}

fn names(model: &Model, nodes: &[NodeId]) -> String {
    let names: Vec<String> = nodes.iter().map(|node| name(model, *node)).collect();
    names.join(", ")
}

fn words(shape: &Option<Vec<Dimension>>) -> String {
    format!("{:?}", shape.as_deref().unwrap_or_default())
}
