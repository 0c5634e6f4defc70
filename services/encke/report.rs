//! `encke report`: one page from a run's report or recording. And how a report is written.

use std::io::{self, Write};
use std::path::Path;

use ground::RunFigures;
use serde::Serialize;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};

use crate::cli::ReportArgs;
use crate::{Failure, outputs};

/// Reads the file, writes the page.
pub(crate) fn report(args: &ReportArgs) -> Result<(), Failure> {
    let refused = |cause: &dyn std::fmt::Display| Failure::start(format!("{}: {cause}", args.file.display()));
    let figures = RunFigures::read(&args.file).map_err(|cause| refused(&cause))?;
    if args.json {
        return crate::print(&(to_json(&figures)? + "\n"));
    }
    let out = args.out.clone().unwrap_or_else(|| args.file.with_extension("html"));
    let page = figures.to_html();
    if out == Path::new("-") {
        return crate::print(&page);
    }
    let _pipes = outputs::check(&[("--out", Some(&out))], &args.file)?;
    outputs::write_whole(&out, page.as_bytes())?;
    crate::print(&format!("{}\n", out.display()))
}

/// Objects and lists below this depth stand on one line.
const DEPTH: usize = 3;

/// A report as JSON that people can read, too: what is deep inside stands on one line.
pub(crate) fn to_json(report: &impl Serialize) -> Result<String, Failure> {
    let mut bytes = Vec::new();
    let shallow = Shallow { pretty: PrettyFormatter::new(), depth: 0 };
    report.serialize(&mut serde_json::Serializer::with_formatter(&mut bytes, shallow)).map_err(Failure::run)?;
    String::from_utf8(bytes).map_err(Failure::run)
}

/// Indents as far as [`DEPTH`].
struct Shallow<'a> {
    pretty: PrettyFormatter<'a>,
    depth: usize,
}

/// Hands a call on to one of two formatters, by the depth at which it comes.
macro_rules! by_depth {
    ($self:ident, $depth:expr, $call:ident ( $($argument:expr),* )) => {
        if $depth > DEPTH { CompactFormatter.$call($($argument),*) } else { $self.pretty.$call($($argument),*) }
    };
}

impl Formatter for Shallow<'_> {
    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth += 1;
        by_depth!(self, self.depth, begin_array(writer))
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth -= 1;
        by_depth!(self, self.depth + 1, end_array(writer))
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        by_depth!(self, self.depth, begin_array_value(writer, first))
    }

    fn end_array_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        by_depth!(self, self.depth, end_array_value(writer))
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth += 1;
        by_depth!(self, self.depth, begin_object(writer))
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth -= 1;
        by_depth!(self, self.depth + 1, end_object(writer))
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        by_depth!(self, self.depth, begin_object_key(writer, first))
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        by_depth!(self, self.depth, begin_object_value(writer))
    }

    fn end_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        by_depth!(self, self.depth, end_object_value(writer))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn what_is_deep_stands_on_one_line_and_reads_back_the_same() {
        let value = json!({"a": {"rows": [{"x": 1, "deep": [1, {"y": []}]}, {}], "empty": []}, "b": [[[["é\n\""]]]]});
        let text = to_json(&value).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
        assert!(text.contains(r#"{"deep":[1,{"y":[]}],"x":1},"#), "{text}");
        assert!(text.starts_with("{\n  \"a\": {\n    \"empty\": []"), "{text}");
    }
}
