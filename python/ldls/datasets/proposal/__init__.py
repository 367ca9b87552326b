"""An ldls.toml for a folder of files: what the files tell, and questions about the rest."""

from ldls.datasets.proposal.proposal import Proposal, propose

__all__ = ["Proposal", "propose"]
