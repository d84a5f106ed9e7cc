//! Parts of an expression that physics may depend on: references that are subtracted from a quantity, and inputs that
//! change with time.

use super::operator::Binary;
use super::tree::{Id, Node, NodeKind, Tree};
use super::{Fault, Scope};

impl Scope {
    /// Expressions that a text subtracts from a name or from which it subtracts the name, such as `ambient` for `x` in
    /// `loss * (ambient - x)`. Only those without a name of `variable` are returned, each once.
    ///
    /// # Errors
    /// The syntax fault of the text.
    pub fn references(
        &self,
        text: &str,
        name: &str,
        variable: &dyn Fn(&str) -> bool,
    ) -> Result<Vec<String>, Fault> {
        let tree = self.tree(text)?;
        let is_name = |id: Id| matches!(&tree.nodes[id].kind, NodeKind::Name(own) if own == name);
        let mut found: Vec<String> = Vec::new();
        for node in &tree.nodes {
            let NodeKind::Binary(Binary::Subtract, a, b) = node.kind else { continue };
            let other = match (is_name(a), is_name(b)) {
                (true, false) => b,
                (false, true) => a,
                _ => continue,
            };
            let Some(part) = self.written(&tree, other) else { continue };
            if !tree.depends(other, variable) && !found.contains(&part) {
                found.push(part);
            }
        }
        Ok(found)
    }

    /// The largest parts of a text that depend on `time` or a table and on no name of `variable`, such as
    /// `sin(2 * pi * t)` or `force(t)`, each once. A sum, a product and a quotient count by their parts, so that
    /// coefficients are left out.
    ///
    /// # Errors
    /// The syntax fault of the text.
    pub fn inputs(
        &self,
        text: &str,
        time: &str,
        variable: &dyn Fn(&str) -> bool,
    ) -> Result<Vec<String>, Fault> {
        let tree = self.tree(text)?;
        let moves = |id: Id| {
            tree.any(id, &|node| match &node.kind {
                NodeKind::Name(name) => name == time,
                NodeKind::Table(..) => true,
                _ => false,
            })
        };
        let mut found: Vec<String> = Vec::new();
        let mut open = vec![tree.nodes.len() - 1];
        while let Some(id) = open.pop() {
            let node = &tree.nodes[id];
            let splits = matches!(
                node.kind,
                NodeKind::Binary(
                    Binary::Add | Binary::Subtract | Binary::Multiply | Binary::Divide,
                    ..
                ) | NodeKind::Unary(..)
            );
            if !moves(id) {
                continue;
            }
            if splits || tree.depends(id, variable) {
                open.extend(node.operands().into_iter().rev());
                continue;
            }
            let Some(part) = self.written(&tree, id) else { continue };
            let is_time = matches!(&node.kind, NodeKind::Name(_));
            if !is_time && !found.contains(&part) {
                found.push(part);
            }
        }
        Ok(found)
    }

    fn tree(&self, text: &str) -> Result<Tree, Fault> {
        Tree::parse(text, &self.tables())
    }

    /// The text of a part; `None` if the part begins or ends within parentheses that enclose a part of it.
    fn written(&self, tree: &Tree, id: Id) -> Option<String> {
        let text = tree.text[tree.nodes[id].span.clone()].trim().to_owned();
        self.tree(&text).is_ok().then_some(text)
    }
}

impl Tree {
    /// Returns true if a node of this part fits.
    fn any(&self, id: Id, fits: &dyn Fn(&Node) -> bool) -> bool {
        let mut open = vec![id];
        while let Some(id) = open.pop() {
            let node = &self.nodes[id];
            if fits(node) {
                return true;
            }
            open.extend(node.operands());
        }
        false
    }

    fn depends(&self, id: Id, variable: &dyn Fn(&str) -> bool) -> bool {
        self.any(id, &|node| matches!(&node.kind, NodeKind::Name(name) if variable(name)))
    }
}

impl Node {
    /// The operands of a node, in the order of the text.
    fn operands(&self) -> Vec<Id> {
        match &self.kind {
            NodeKind::Number(..) | NodeKind::Name(_) => Vec::new(),
            NodeKind::Unary(_, a) | NodeKind::Table(_, a) => vec![*a],
            NodeKind::Binary(_, a, b) | NodeKind::Index(a, b) => vec![*a, *b],
            NodeKind::Call(_, all) | NodeKind::List(all) => all.clone(),
            NodeKind::Slice(a, from, to) => std::iter::once(*a).chain(*from).chain(*to).collect(),
        }
    }
}
