// All of Sherlog's public interface: models and evidence in, a ground network between, answers out.
//
//   parse_model -> Model ─┐
//   parse_evidence ───────┼─ ground -> GroundNetwork ─ infer -> InferenceResult
//   parse_query ──────────┘
//
//   Model + training databases ─ learn -> LearningResult ─ learned_model_text -> a new model
//   Model + databases ─ cross_validate -> CrossValidationResult
//
// examples/infer_in_ten_lines.cpp and examples/learn_weights.cpp are whole programs.
#pragma once

#include "grounding/export.h"
#include "grounding/ground.h"
#include "grounding/network.h"
#include "inference/advice.h"
#include "inference/explain.h"
#include "inference/inference.h"
#include "learning/confusion_report.h"
#include "learning/cross_validation.h"
#include "learning/evaluation.h"
#include "learning/learn.h"
#include "learning/learned_model.h"
#include "mln/convert.h"
#include "mln/diagnostics.h"
#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/monitor.h"
#include "mln/parser.h"
#include "mln/printer.h"
#include "mln/query.h"
#include "perception_bridge/annotation_types.h"
#include "perception_bridge/association_question.h"
#include "perception_bridge/concepts.h"
#include "perception_bridge/evidence_mapping.h"
#include "perception_bridge/kitchen_generator.h"
#include "perception_bridge/kitchen_scenes.h"
#include "perception_bridge/observe.h"
#include "perception_bridge/open_question.h"
#include "perception_bridge/scene.h"
#include "perception_bridge/scene_lines.h"
#include "perception_bridge/scene_store.h"
#include "perception_bridge/scene_tracker.h"
#include "perception_bridge/similarity.h"
#include "perception_bridge/step_picture.h"
#include "perception_bridge/trackers.h"
#include "perception_bridge/tracking_arbiter.h"
#include "perception_bridge/view.h"
